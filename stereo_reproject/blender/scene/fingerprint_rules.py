"""Rules for properties of Blender's datablocks: those that cannot be seen in a picture, and those that repeat others.

What Blender works out (matrices in the world, bounds, statistics) follows from what counts, and changes while it works.
"""

from __future__ import annotations

import re

import bpy

OF_NO_PICTURE = re.compile(
    r"rna_type|bl_\w+|name_full|original|library|library_weak_reference|override_library|asset_data|preview|depsgraph"
    r"|tag|users|use_(fake|extra)_user|is_runtime_data|session_uid|select|select_\w+|active_.*|\w*_active|show_expanded"
    r"|show_viewport|show_in_editmode|show_on_cage|hide_viewport|hide_select|lock_(?!ik)\w+|use_pin|use_pin_to_last|is_active|ui_\w+"
    r"|annotation\w*|motion_path|animation_visualization|selection_sets|stereo_reproject|last_slot_identifier"
    r"|action_suitable_slots|action_tweak_storage|action_slot_handle_tweak_storage|set_inverse_pending|open_\w+"
)
"""Properties of every type on which no picture depends."""

OF_TYPE = {
    "Object": r"dimensions|matrix_(world|local|basis)|bound_box|mode|display|display_\w+"
    r"|show_(?!instancer_for_render|only)\w+|empty_\w+|use_mesh_mirror_\w+|use_camera_lock_parent|use_empty_image_alpha|image_user"
    r"|use_shape_key_edit_mode|use_dynamic_topology_sculpting",
    "Scene": r"objects|frame_(start|end|step|current\w*|float|subframe|preview_\w+)|time_jump_\w+|use_preview_range"
    r"|allow_preroll|show_\w+|use_stamp_note|sync_mode|playback_loop_mode|sequence_editor|keying_sets\w*"
    r"|tool_settings|safe_areas|transform_orientation_slots|cursor|use_audio\w*|audio_\w+|sequencer_\w+"
    r"|display|hydra",
    "RenderSettings": r"filepath|image_settings|ffmpeg|use_(overwrite|placeholder|file_extension|lock_interface)"
    r"|threads\w*|use_persistent_data|\w*stamp\w*|save_output|preview_pixel_size|bake|sequencer_\w+|use_sequencer\w*"
    r"|use_single_layer|compositor_(device|denoise_device|denoise_preview_quality)|use_render_cache|metadata_input"
    r"|ppm_\w+|use_auto_generate_texture_cache|use_multiview|views|stereo_views|views_format|use_bake\w*|bake_\w+",
    "CyclesRenderSettings": r"device|debug_\w+|preview_\w+|use_preview_\w+|denoising_use_gpu|bake_type|use_auto_tile"
    r"|tile_size|texture_limit",
    "SceneEEVEE": r"taa_samples|use_taa_reprojection|gi_show_\w+|gi_cache_info",
    "ViewLayer": r"objects|depsgraph",
    "Collection": r"all_objects|exporters|color_tag",
    "Camera": r"angle|angle_x|angle_y|show_\w+|display_size|passepartout_alpha|composition_\w+|background_images",
    "Material": r"texture_paint_\w+|paint_\w+|preview_\w+|use_preview_world",
    "NodeTree": r"links|view_center|color_tag|default_group_node_width|description",
    "Node": r"location|location_absolute|width|height|dimensions|label|parent|internal_links|color|color_tag|hide"
    r"|use_custom_color|show_\w+|panel_states|warning_propagation",
    "NodeFrame": r"label_size|shrink|text",
    "CompositorNodeOutputFile": r"base_path|directory|file_name|format|file_slots|layer_slots|file_output_items"
    r"|save_as_render",
    "NodeSocket": r"node|enabled|hide|description|display_shape|label|pin_gizmo|inferred_structure_type|hide_value",
    "NodeTreeInterfaceItem": r"parent|description|index",
    "Action": r"frame_range|curve_frame_range|fcurves|groups|id_root|pose_markers",
    "ActionChannelbag": r"groups|slot",
    "AnimData": r"action_slot",
    "NlaStrip": r"action_slot|frame_(start|end)_ui",
    "FCurve": r"color|color_mode|hide|lock|is_valid|group",
    "Driver": r"is_valid|is_simple_expression",
    "Key": r"user|reference_key",
    "Pose": r"use_mirror_\w+|use_auto_ik",
    "PoseBone": r"bone|parent|child|matrix|matrix_(basis|channel)|head|tail|length|is_in_ik_chain|hide|color"
    r"|custom_shape\w*|use_(transform|custom_shape)\w*",
    "Bone": r"parent|children|collections|color|display_type|show_wire|hide|matrix",
    "Armature": r"edit_bones|collections|collections_all|display_type|show_\w+|axes_position|relation_line_position"
    r"|use_mirror_x",
    "ColorRampElement": r"alpha",
    "ImageUser": r"frame_current",
    "MovieClipUser": r"frame_current",
    "CacheFile": r"object_paths",
    "PointCache": r"index|info|name|point_caches|is_outdated|is_frame_skip|is_baking|filepath|use_disk_cache"
    r"|use_external|use_library_path",
    "ParticleSystem": r"particles|child_particles|cloth|point_cache",
    "ParticleSettings": r"display_\w+|show_(?!unborn)\w+|material_slot",
    "RigidBodyWorld": r"point_cache",
    "Text": r"current_\w+|lines|filepath|indentation|use_module|is_\w+|region_\w+|cursor_\w+",
    "Curve": r"cursor\w*|select_\w+|has_selection|texspace_\w+|use_auto_texspace|edit_format|is_editmode",
    "Curves": r"curves|points|position_data|normals|color_attributes|selection_\w+|use_mirror_\w+|use_sculpt_\w+",
    "PointCloud": r"points|color_attributes",
    "GreasePencilDrawing": r"color_attributes|strokes",
    "GreasePencil": r"root_nodes|color_attributes",
    "GreasePencilTreeNode": r"next_node|prev_node|parent_group",
    "UnitSettings": r"(?!scale_length).*",
    "CompositorNodeImage": r"layer|view",
    "Volume": r"grids|display",
    "Light": r"temperature_color",
    "MovieClip": r"proxy|display_aspect|use_proxy\w*",
    "Speaker": r"sound",
    "Mesh": r"vertices|edges|loops|polygons|uv_layer\w*|vertex_colors|skin_vertices|attributes|color_attributes"
    r"|use_mirror_\w+|use_paint_\w+|radial_symmetry|remesh_\w+|use_remesh_\w+|corner_normals|vertex_normals"
    r"|polygon_normals|loop_\w+|vertex_\w+|edge_\w+|texspace_\w+",
    "NodesModifier": r"node_warnings|panels|show_\w+group\w*|show_manage_panel|bake_directory",
    "NodesModifierBake": r"node|directory|data_blocks",
    "FluidDomainSettings": r"cache_frame_(pause|offset)\w*|cache_directory|\w+_grid",
    "Image": r"filepath\w*|file_format|render_slots|layers|resolution|pixels|generated_\w+|use_generated_float"
    r"|display_aspect|packed_files?",
    "UDIMTile": r"(?!number).*",
    "Sound": r".*",
    "Library": r".*",
}
"""Further properties on which no picture depends, of these types and those derived from them."""

READ_ONLY_THAT_COUNT = {
    "Bone": ("head_local", "tail_local", "matrix_local", "use_connect", "length"),
    "ActionSlot": ("handle",),
    "ActionChannelbag": ("slot_handle",),
    "NodeSocket": ("identifier",),
    "NodeTreeInterfaceSocket": ("identifier", "in_out"),
    "NodeTreeInterfaceItem": ("item_type",),
    "PointCache": ("is_baked",),
    "Spline": ("type",),
    "VertexGroup": ("index",),
    "SplinePoint": ("co",),
}
"""Read-only properties that count, by type; all others follow from those that can be set."""

GROUPS_OF_ADDONS = re.compile(r"cycles\w*|stereo_reproject|_RNA_UI")
"""Custom properties that are not the user's."""

EXTENDED = (bpy.types.ID, bpy.types.ViewLayer, bpy.types.Bone, bpy.types.PoseBone, bpy.types.Node)
"""Types to which add-ons give properties of their own: a Blender of the farm may not have the add-on."""


def counts(struct: bpy.types.bpy_struct, prop: bpy.types.Property) -> bool:
    """Return whether a property of a struct may change a picture, so that a fingerprint must have it. False also for
    one that only repeats what others say.
    """
    name = prop.identifier
    if OF_NO_PICTURE.fullmatch(name) or getattr(prop, "is_deprecated", False):
        return False
    if prop.is_runtime and not name.startswith("cycles") and isinstance(struct, EXTENDED):
        return False
    if prop.type == "STRING" and prop.subtype == "DIR_PATH":
        return False
    lineage = tuple(_lineage(struct.bl_rna))
    if any(re.fullmatch(OF_TYPE[kind], name) for kind in lineage if kind in OF_TYPE):
        return False
    if prop.is_readonly and prop.type not in ("POINTER", "COLLECTION"):
        return any(name in READ_ONLY_THAT_COUNT.get(kind, ()) for kind in lineage)
    return True


def _lineage(kind: bpy.types.Struct | None):
    """Yield the name of a type of struct, and of those that it is made from."""
    while kind is not None:
        yield kind.identifier
        kind = kind.base
