"""Server on the robot: authentication, the control lease, observations and recordings.

`process.Daemon` assembles the parts. `server` bounds connections before authentication and serves
the console, `connection` and `session` handle one client, and `hub` holds the state that all
clients share: the lease (`control`), the recorder and the library. `guard_link` passes orders to
the guard, which alone owns the outputs.
"""
