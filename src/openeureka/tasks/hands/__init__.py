"""A cube turned in one hand: AllegroHand and ShadowHand."""
