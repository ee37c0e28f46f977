"""What a message says: schema text becomes a type tree, the tree a plan, payload bytes arrays.

Layers, each ignorant of the ones below it in this list:

``types``     the tree of a message type, whatever language it was declared in
``rosmsg``    ROS 1 and ROS 2 definitions -> tree
``cdr``       tree + wanted leaves -> plan; plan + payload bytes -> arrays, no Python per message
``objects``   JSON and protobuf: one object per message -> the same arrays
``roles``     which part of a tree is an IMU, a fix, a speed; its units and stamps
``decoder``   an encoding's name -> tree and decoder (one table)
``clocks``    header, publish and log time: statistics and choice
``assemble``  decoded topics -> Log: which topic is used, units, clocks, findings

Containers (MCAP, and bags through an optional package) deliver batches of payloads to it.
"""
