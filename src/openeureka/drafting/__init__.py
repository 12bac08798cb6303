"""Task files drafted for `eureka new`, from a robot's model and a sentence."""
