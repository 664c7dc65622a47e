"""Client of a robot on the network: connection, env, recordings, and keyboard control."""
