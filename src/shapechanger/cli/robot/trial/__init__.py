"""Fault trials of a robot on its twin, judged by the twin's ledger."""
