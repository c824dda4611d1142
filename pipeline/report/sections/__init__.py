"""The sections of the report, a module each; `order` lists them as they follow each other."""
