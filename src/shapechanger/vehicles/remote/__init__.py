"""Vehicles on the network and policies on board."""
