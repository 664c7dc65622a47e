"""Server on the robot: authentication, the control lease, observations and recordings.

`process.Daemon` assembles the parts, and passes orders to the guard, which alone owns the outputs.
`server` bounds connections before authentication and serves the console, `session` handles one
client, and `hub` holds the state that all clients share: the lease, the recorder and the library.
"""
