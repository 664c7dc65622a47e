"""One policy for the bodies of a family with any number of limbs."""
