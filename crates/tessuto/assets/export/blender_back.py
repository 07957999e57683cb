import_print = import_fabric


def import_fabric(home):
    """The other side has a colour of its own. Files have it as faces in the same places, which only programs that leave
    out what is seen from behind can tell apart: here one surface stays, whose material asks which side is seen."""
    imported = import_print(home)
    fabrics = [added for added in imported if added.type == "MESH"]
    for fabric in fabrics:
        if keep_print(fabric.data):
            for material in fabric.data.materials:
                show_both_sides(material)
        else:
            imported.remove(fabric)
            bpy.data.objects.remove(fabric)
    return imported


def is_back(material):
    return material is not None and material.name.split(".")[0] in ("Back", CLIP["name"] + "_back")


def keep_print(mesh):
    """Takes the faces of the other side away; whether others are left."""
    import bmesh

    backs = [k for k, material in enumerate(mesh.materials) if is_back(material)]
    surface = bmesh.new()
    surface.from_mesh(mesh)
    gone = [face for face in surface.faces if face.material_index in backs]
    left = len(gone) < len(surface.faces)
    if gone and left:
        bmesh.ops.delete(surface, geom=gone, context="FACES")
        surface.to_mesh(mesh)
        for k in reversed(backs):
            mesh.materials.pop(index=k)
    surface.free()
    return left


def show_both_sides(material):
    nodes, links = material.node_tree.nodes, material.node_tree.links
    if any(node.type == "NEW_GEOMETRY" for node in nodes):
        return
    end = next(node for node in nodes if node.type == "OUTPUT_MATERIAL").inputs["Surface"]
    back, mix = nodes.new("ShaderNodeBsdfPrincipled"), nodes.new("ShaderNodeMixShader")
    back.inputs["Base Color"].default_value = tuple(CLIP["back"]) + (1,)
    back.inputs["Roughness"].default_value = 1
    links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
    links.new(end.links[0].from_socket, mix.inputs[1])
    links.new(back.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], end)
    material.use_backface_culling = False


