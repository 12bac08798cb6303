"""The twenty tasks with two Shadow Hands, and the pens in one; the scene and objects they are made of."""
