"""The three roles of the service: the receiver holds vendors' sockets, the engine computes, the operator face serves.

Each runs in a process of its own, or all run in one. In both cases they call each other over sockets in one runtime
directory.
"""
