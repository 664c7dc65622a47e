"""The fast step of ants and single pendulums, bit-equal to Gymnasium's."""
