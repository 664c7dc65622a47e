"""The fast step of ants and pendulums, bit-equal to Gymnasium's."""
