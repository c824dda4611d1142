"""The live study's pages in a real browser, against a stand-in for its server."""
