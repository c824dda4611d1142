"""What the report says in words: sentences, methods, references and a glossary, all written from a study's tables."""
