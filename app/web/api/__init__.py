"""The interface for other programs, `/api/v1`; each subject is a module, description.py describes them all."""
