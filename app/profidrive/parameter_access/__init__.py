"""Base-mode parameter access of PROFIdrive: requests, answers, formats, error numbers, and the DS47 mailbox that carries them.

Source: reference/profidrive.md section 9, reference/sinamics-modbus.md section 5.
"""
