"""The twenty tasks with two Shadow Hands, the scene and objects they are made of."""
