"""One recording: from the bytes of its log to what a person saw and did."""
