# Shows of a model what may be seen from the view cell that holds the camera; Godot 4.4 or newer.
# viewcell export house.bake --glb house.glb --json house.json
extends Node3D

@export_file("*.glb") var model_file := "res://house.glb"
@export_file("*.json") var sets_file := "res://house.json"

var cells: Array = []
var potential: Array[Dictionary] = []
var nodes := {}


func _ready() -> void:
	var document := GLTFDocument.new()
	var state := GLTFState.new()
	document.append_from_file(model_file, state)
	var model := document.generate_scene(state)
	add_child(model)
	for node in model.find_children("*", "Node3D", true, false):
		if node.has_meta("extras") and node.get_meta("extras").has("id"):
			nodes[int(node.get_meta("extras")["id"])] = node
	cells = JSON.parse_string(FileAccess.get_file_as_string(sets_file))["cells"]
	for cell in cells:
		var ids := {}
		for id in cell["potential"]:
			ids[int(id)] = true
		potential.append(ids)


func _process(_delta: float) -> void:
	var eye := get_viewport().get_camera_3d().global_position
	# Y up to Z up.
	var row := row_at(eye.x, -eye.z, eye.y)
	for id in nodes:
		# In no view cell: everything.
		nodes[id].visible = row < 0 or potential[row].has(id)


# The first view cell that holds an eye is the smallest; -1 where none does.
func row_at(x: float, y: float, z: float) -> int:
	for row in range(cells.size()):
		var held: bool = z >= cells[row]["bottom"] and z <= cells[row]["top"]
		for k in range(4):
			var a: Array = cells[row]["plan"][k]
			var b: Array = cells[row]["plan"][(k + 1) % 4]
			held = held and (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0
		if held:
			return row
	return -1
