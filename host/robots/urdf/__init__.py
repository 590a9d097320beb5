"""URDF files of ROS: robots of the kind `chain` are made of them and written as them."""
