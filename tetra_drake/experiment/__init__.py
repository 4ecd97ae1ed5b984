"""The thesis's experiment: what its recorded runs are analysed for, and the tables made of them."""
