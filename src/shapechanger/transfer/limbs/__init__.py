"""One policy for the bodies of a family, whatever the number of their limbs."""
