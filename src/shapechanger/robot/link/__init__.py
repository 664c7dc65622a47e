"""Protocol between a robot and its clients, without sockets, for both sides."""
