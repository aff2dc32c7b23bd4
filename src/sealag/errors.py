"""The error tree: one root, children that also are the builtin that a caller expects.

A message says what was wrong, where (file, key, joint, frame) and what would be right, in one
sentence. "Not certified" is a result and never an exception.
"""


class SealagError(Exception):
    """Root of every error that sealag raises on purpose; the command line exits with status 2."""


class InputError(SealagError, ValueError):
    """A value given by the user cannot be used: wrong shape, unit, sign, NaN or out of range."""


class FileError(SealagError, OSError):
    """A file cannot be read or written: missing, too large, not the format its name says."""


class ProjectError(InputError):
    """The project file (TOML) does not match its schema; the message names file and key."""


class MotionError(InputError):
    """A motion file has unknown or missing columns, NaN rows or times that do not increase."""


class RobotError(InputError):
    """A URDF cannot be turned into a robot, or a configuration does not fit the robot."""


class UnknownNameError(SealagError, KeyError):
    """A joint, frame, task or robot name does not exist; the message lists near matches."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ContractionError(SealagError, ArithmeticError):
    """The static joint state has no contraction: springs too soft for the task stiffness."""


class SolverError(SealagError, RuntimeError):
    """A numerical method stopped before its answer could be trusted."""


class CertificateError(SealagError, ValueError):
    """A certificate file is not readable as a certificate at all."""
