"""Many designs of one project, asked on all cores or a cluster, into one Parquet dataset."""

from sealag.sweep._sweep import Sweep

__all__ = ["Sweep"]
