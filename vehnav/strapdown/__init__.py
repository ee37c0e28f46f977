"""Strapdown integration: increments from samples, then the mechanizations of the papers."""
