"""Small faults put into the sources on purpose: does a test notice each of them?"""
