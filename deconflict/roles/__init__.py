"""The three roles of the service: the receiver holds vendors' sockets, the engine computes, the operator face serves.

Each runs in a process of its own, or all in one; they meet over links in one runtime directory either way.
"""
