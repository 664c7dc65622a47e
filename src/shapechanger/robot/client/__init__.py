"""Client of a robot on the network: its connection, its env, its recordings, and the keys."""
