"""The processes of the service: the supervisor, and the fork server that its roles are copies of.

The fork server loads the code of all roles once. Each role is a fork of it, so the roles share that memory, and a role
that ended runs again without loading anything.
"""
