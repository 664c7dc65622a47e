"""Server on the robot: authentication, the control lease, observations and recordings.

`process.Daemon` assembles the parts. `server` listens and serves the console, `pre_auth` bounds
connections before authentication, `connection` and `session` handle one client, and `hub` holds
what all clients share: the lease and the commands (`control`), the recorder and the library.
`guard_link` passes orders to the guard, which alone owns the outputs.
"""
