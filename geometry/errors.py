"""The errors that speak to the user: what came, what is allowed, what to do.

The command line prints the text of a `LidarplanError` and exits with code 2; any other exception is a defect.
"""


class LidarplanError(Exception):
    """Something the user can mend."""


class InputError(LidarplanError, ValueError):
    """A value that cannot be used: the text says what came, what is allowed and what to do."""


class UnavailableError(LidarplanError):
    """This machine or installation lacks something the request needs (OpenGL, an extra, a server)."""
