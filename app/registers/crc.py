"""The check sum of a Modbus RTU frame (Modbus over serial line 1.02, section 6.2.2)."""


def _row(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_TABLE = tuple(_row(byte) for byte in range(256))


def crc16(data: bytes) -> int:
    """CRC-16 of `data`: polynomial 0xA001 (reflected), start 0xFFFF. On the wire the low byte goes first."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc


def with_crc(data: bytes) -> bytes:
    """`data` with its check sum behind it."""
    return data + crc16(data).to_bytes(2, "little")


def crc_holds(frame: bytes) -> bool:
    """Whether the last two bytes of `frame` are the check sum of the others."""
    return len(frame) > 2 and crc16(frame[:-2]) == int.from_bytes(frame[-2:], "little")
