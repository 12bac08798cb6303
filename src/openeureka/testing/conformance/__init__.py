"""What every implementation of an extension point must do, as test classes to inherit."""
