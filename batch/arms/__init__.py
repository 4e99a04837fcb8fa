"""Drawing of arms: poses and shapes of links, for one case or for all cases at once.

shapes    simple solids and lines, fixed to the links' frames
meshes    what links look like by files, read from STL, OBJ and glTF, reduced to what a picture needs
gltf      the triangles of a glTF file, by trimesh
look      sizes, colours and the viewpoint, and the scripts that draw an arm on a page
scene     the links' frames in the world, from the numbers of a case; frames and shapes as formulas of what a case
          records and a sweep varies, which a page replays
drawn     scene and what acts on it, which is loads, contact, gas of thrusters and payloads, as such formulas too; and
          the columns of a run that they need
"""
