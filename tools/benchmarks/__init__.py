"""The measurements behind `make bench`, one module each; `common` is what they share."""
