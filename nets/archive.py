"""A canonical ZIP archive: for the same members always the same bytes, and no other bytes are read as those members.

Any tool opens the archive, but this reader takes one spelling only: members stored uncompressed, in the order of their
names, with fixed dates and flags, nothing before, between or behind them. It finds the members in the local headers,
writes them again and compares, so a change of any byte is seen, in a header nobody else reads as much as in the data.
Nothing is ever unpacked: what is compressed, encrypted or larger than the file itself is another spelling.

The alternative, the standard library's `zipfile`, writes headers that differ from version to version, and reads far
more than it writes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from typing import Final
from zlib import crc32

MEMBERS_MAX: Final = 65_000

_NAME: Final = re.compile(r"[A-Za-z0-9_.~%/-]{1,1000}")
SIGNATURE: Final = b"PK\x03\x04"
"""What every archive with a member begins with."""

_LOCAL: Final = struct.Struct("<4s5H3I2H")
_CENTRAL: Final = struct.Struct("<4s6H3I5H2I")
_END: Final = struct.Struct("<4s4H2IH")
_VERSION, _DATE = 10, 0x21  # ZIP 1.0, and 1980-01-01


class ArchiveError(ValueError):
    """The bytes are not an archive in the canonical spelling."""


def pack(members: Mapping[str, bytes]) -> bytes:
    """The archive of these members; raises `ArchiveError` where a name or the size does not fit.

    >>> sorted(unpack(pack({"b.txt": b"2", "a.txt": b""})).items())
    [('a.txt', b''), ('b.txt', b'2')]
    """
    if len(members) > MEMBERS_MAX:
        raise ArchiveError(f"{len(members):,} files are more than an archive holds ({MEMBERS_MAX:,})")
    body, directory = bytearray(), bytearray()
    for name, data in sorted(members.items()):
        if not _NAME.fullmatch(name):
            raise ArchiveError(f"{name!r} cannot name a file of the archive")
        if len(body) + len(data) >= 1 << 31:
            raise ArchiveError("the archive would be larger than 2 GiB")
        spelled = name.encode("ascii")
        sizes = (crc32(data), len(data), len(data), len(spelled))
        directory += _CENTRAL.pack(b"PK\x01\x02", _VERSION, _VERSION, 0, 0, 0, _DATE, *sizes, 0, 0, 0, 0, 0, len(body))
        directory += spelled
        body += _LOCAL.pack(SIGNATURE, _VERSION, 0, 0, 0, _DATE, *sizes, 0) + spelled + data
    end = _END.pack(b"PK\x05\x06", 0, 0, len(members), len(members), len(directory), len(body), 0)
    return bytes(body + directory + end)


def unpack(archive: bytes) -> dict[str, bytes]:
    """The members of an archive that `pack` made; raises `ArchiveError` for any other bytes."""
    members: dict[str, bytes] = {}
    position = 0
    while archive[position : position + 4] == SIGNATURE:
        if position + _LOCAL.size > len(archive) or len(members) >= MEMBERS_MAX:
            raise ArchiveError("the archive is cut off or holds too many files")
        size_bytes, name_bytes = _LOCAL.unpack_from(archive, position)[8:10]
        start = position + _LOCAL.size
        position = start + name_bytes + size_bytes
        if position > len(archive):
            raise ArchiveError("the archive is cut off")
        members[archive[start : start + name_bytes].decode("latin-1")] = archive[start + name_bytes : position]
    if pack(members) != archive:
        raise ArchiveError("the archive is not as it was written")
    return members
