"""What machines tell, and what is made of it: events, the words of their snapshots, records. Pure."""
