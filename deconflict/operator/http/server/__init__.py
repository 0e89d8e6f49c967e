"""The server below the HTTP application: its protocols, and places for connections."""
