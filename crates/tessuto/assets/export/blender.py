

# Sets a scene of Blender up so that its image is the video's: frame rate and range, resolution and shape of the
# pixels, the camera with its lens shift, the video behind it, and the recovered light. Written for Blender 4.2
# to 5.
#
#   blender --python FILE                          opens it
#   blender -b --python FILE -- 20 out.png         renders frame 20 into out.png and ends
#
# or open it in the Scripting tab and press Run. It adds to the scene that is open; only the cube, light and camera of
# Blender's first start are left out of the render.

import math
import os
import sys

import bpy


def folder():
    """Where this file is, whether Blender runs it from disk or from its text editor."""
    text = getattr(getattr(bpy.context, "space_data", None), "text", None)
    path = bpy.path.abspath(text.filepath) if text and text.filepath else __file__
    return os.path.dirname(os.path.abspath(path))


def whole_rate():
    return max(1, math.ceil(CLIP["fps"] - 1e-6))


def set_time(scene):
    scene.render.fps, scene.render.fps_base = whole_rate(), whole_rate() / CLIP["fps"]
    scene.frame_start, scene.frame_end = 0, CLIP["frames"] - 1
    scene.frame_set(0)


def set_picture(scene):
    width, height, fx, fy = (CLIP[key] for key in ("width", "height", "fx", "fy"))
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    # Pixels are as wide as 1 / fx and as high as 1 / fy; neither side may be below 1 here.
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, fy / fx), max(1.0, fx / fy)
    render.film_transparent = True
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    render.engine = "CYCLES"


def import_glb(path):
    """The importer puts keys at seconds times fps times fps_base, although the rate is fps divided by fps_base:
    its product has to be the rate."""
    render, before = bpy.context.scene.render, set(bpy.data.actions)
    render.fps, render.fps_base = whole_rate(), CLIP["fps"] / whole_rate()
    bpy.ops.import_scene.gltf(filepath=path)
    put_on_frames([action for action in bpy.data.actions if action not in before])


def put_on_frames(actions):
    """Importers that know another rule put keys beside the frames: the rule that all of them obey says how to
    move them."""
    curves = [curve for action in actions for curve in curves_of(action)]
    keys = [key for curve in curves for key in curve.keyframe_points]
    off = lambda factor: max([abs(key.co[0] * factor - round(key.co[0] * factor)) for key in keys], default=0.0)
    base = CLIP["fps"] / whole_rate()
    best = min((1.0, base, base * base), key=lambda factor: off(factor) + (factor != 1.0) * 1e-3)
    for key in keys:
        frame = round(key.co[0] * best)
        key.handle_left[0] += frame - key.co[0]
        key.handle_right[0] += frame - key.co[0]
        key.co[0] = frame
    if best != 1.0:
        for strip in strips_of(actions):
            strip.action_frame_start, strip.action_frame_end = strip.action.frame_range


def strips_of(actions):
    """Those on tracks that play one of the actions."""
    owners = [o for o in bpy.data.objects] + [key for key in bpy.data.shape_keys]
    tracks = [t for o in owners if o.animation_data for t in o.animation_data.nla_tracks]
    return [strip for track in tracks for strip in track.strips if strip.action in actions]


def curves_of(action):
    """Of any version: actions have had layers since 4.4."""
    if not getattr(action, "layers", None):
        return list(getattr(action, "fcurves", ()))
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def import_fabric(home):
    before = set(bpy.data.objects)
    glb, usd = (os.path.join(home, CLIP["name"] + ending) for ending in (".glb", ".usda"))
    if os.path.isfile(glb):
        import_glb(glb)
    elif os.path.isfile(usd):
        bpy.ops.wm.usd_import(filepath=usd)
    else:
        raise SystemExit("neither %s nor %s is there: export one of them beside this file" % (glb, usd))
    return [added for added in bpy.data.objects if added not in before]


def hide_startup(imported):
    for name in ("Cube", "Light"):
        found = bpy.data.objects.get(name)
        if found is not None and found not in imported:
            found.hide_render = found.hide_viewport = True


def new_camera(scene, name, table):
    width, height, fx, fy, cx, cy = (table[key] for key in ("width", "height", "fx", "fy", "cx", "cy"))
    data = bpy.data.cameras.new(name)
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = fx * 36.0 / width
    data.shift_x = ((width - 1) / 2 - cx) / width
    data.shift_y = (cy - (height - 1) / 2) * (fx / fy) / width
    data.clip_start = 0.01
    camera = bpy.data.objects.new(data.name, data)
    # The file's camera looks along -z with y up; what is imported has been turned so that z is up.
    camera.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    move_camera(camera, table["poses"])
    return camera


def add_camera(scene):
    scene.camera = new_camera(scene, CLIP["name"] + " camera", CLIP)
    for view in CLIP["views"]:
        new_camera(scene, "%s camera %s" % (CLIP["name"], view["name"]), view)
    return scene.camera


def move_camera(camera, poses):
    """Keys of a camera that moved, or stands elsewhere: x right, y down, z ahead there is x, -z, y here."""
    if not poses:
        return
    from mathutils import Matrix

    here = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))
    looks = Matrix.Diagonal((1, -1, -1, 1))
    camera.rotation_mode = "QUATERNION"
    last = None
    for frame, rows in enumerate(poses):
        pose = Matrix([rows[k:k + 4] for k in (0, 4, 8, 12)])
        camera.location, turn, _ = (here @ pose.inverted() @ looks).decompose()
        if last is not None:
            turn.make_compatible(last)
        camera.rotation_quaternion = last = turn
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)


def add_video(home, camera):
    first = os.path.normpath(os.path.join(home, CLIP["video"])) if CLIP["video"] else ""
    if not os.path.isfile(first):
        print("the video's frames are not at %s: no background" % (first or "any known place"))
        return
    image = bpy.data.images.load(first)
    image.source = "SEQUENCE"
    camera.data.show_background_images = True
    background = camera.data.background_images.new()
    background.image, background.alpha, background.frame_method = image, 1.0, "STRETCH"
    user = background.image_user
    user.frame_start, user.frame_duration = 0, CLIP["frames"]
    # File numbers are counted from 1 here.
    user.frame_offset = CLIP["first"] - 1


def add_light(home, scene):
    world = bpy.data.worlds.new(CLIP["name"] + " light")
    scene.world = world
    if not world.node_tree:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    output, shade = nodes.new("ShaderNodeOutputWorld"), nodes.new("ShaderNodeBackground")
    links.new(shade.outputs["Background"], output.inputs["Surface"])
    path = os.path.join(home, CLIP["light"]) if CLIP["light"] else ""
    if not os.path.isfile(path):
        # The print has the light of the video in it: under an even light it looks as it was filmed.
        shade.inputs["Color"].default_value = (1, 1, 1, 1)
        return
    picture, turn = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    place = nodes.new("ShaderNodeTexCoord")
    picture.image = bpy.data.images.load(path)
    picture.image.colorspace_settings.name = "Linear Rec.709"
    # The middle of the map is where the camera looks, which is +y here; Blender's middle is +x.
    turn.inputs["Rotation"].default_value = (0, 0, -math.pi / 2)
    links.new(place.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], shade.inputs["Color"])


def main():
    scene, home = bpy.context.scene, folder()
    # The importer of USD places samples by the frame rate: it comes first.
    set_time(scene)
    imported = import_fabric(home)
    hide_startup(imported)
    set_time(scene)
    set_picture(scene)
    add_video(home, add_camera(scene))
    add_light(home, scene)
    if "--" in sys.argv[1:]:
        frame, path = sys.argv[sys.argv.index("--") + 1:][:2]
        scene.frame_set(int(frame))
        scene.render.filepath = os.path.abspath(path)
        bpy.ops.render.render(write_still=True)


main()
