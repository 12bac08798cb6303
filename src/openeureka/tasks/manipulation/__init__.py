"""FrankaCabinet."""
