"""The papers, figure by figure."""
