"""Files of other software: MuJoCo and NTRT in, SDFormat out."""
