"""Environments of Gymnasium (extra `gym`); the import registers them. See lab.gym.environments."""

from tetra_drake.lab.gym.environments import ROLL as ROLL
from tetra_drake.lab.gym.environments import WALK as WALK
from tetra_drake.lab.gym.environments import TensegrityEnv as TensegrityEnv
from tetra_drake.lab.gym.environments import TensegrityVectorEnv as TensegrityVectorEnv
