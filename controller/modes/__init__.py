"""The modes of operation of a drive (CiA 402-2), and their motion profiles."""
