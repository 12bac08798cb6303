"""Cartpole, BallBalance and Quadcopter."""
