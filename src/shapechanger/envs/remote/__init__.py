"""Gymnasium envs of vehicles and fingers that are reached over the link."""
