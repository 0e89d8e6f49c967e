"""MassRobotics AMR Interoperability Standard 1.0: one message in; an identity, a status or a rejection out."""
