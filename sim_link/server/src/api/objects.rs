//! `sim.*`: finding, making and removing objects.

use ciborium::Value;
use nalgebra::Isometry3;

use super::{Call, Outcome, Table, nothing, one};
use crate::args::ApiError;
use handeye_cell::world::{Handle, Kind, WorldError, paths};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("getObject", get_object),
    ("getObjectHandle", get_object_handle),
    ("getObjectAlias", get_object_alias),
    ("setObjectAlias", set_object_alias),
    ("getObjects", get_objects),
    ("getObjectsInTree", get_objects_in_tree),
    ("getObjectParent", get_object_parent),
    ("setObjectParent", set_object_parent),
    ("getObjectChild", get_object_child),
    ("getObjectType", get_object_type),
    ("isHandle", is_handle),
    ("createDummy", create_dummy),
    ("removeObject", remove_object),
    ("removeObjects", remove_objects),
    ("getModelProperty", get_model_property),
];

const HANDLE_ALL: i64 = -2;
const HANDLE_SCENE: i64 = -12;

fn optional(handle: Handle) -> Option<Handle> {
    (handle >= 0).then_some(handle)
}

fn get_object(call: &mut Call<'_>) -> Outcome {
    let path = call.args.text(0)?;
    let options = call.args.map_or_empty(1)?;
    let index = options.integer("index")?.and_then(|index| usize::try_from(index).ok());
    let proxy = options.integer("proxy")?.and_then(optional);
    let no_error = options.boolean("noError")?.unwrap_or(false);
    match paths::find(&call.cell.world.tree, path, index, proxy) {
        Err(_) if no_error => one(-1),
        found => one(found.map_err(|error| unknown(error, path))?),
    }
}

/// The simulator's words, and which of a program's paths it was.
fn unknown(error: WorldError, path: &str) -> ApiError {
    const SHOWN: usize = 100;
    if error != WorldError::NoSuchPath {
        return error.into();
    }
    let path: String = path.chars().take(SHOWN).collect();
    ApiError::Other(format!("{error} ('{path}'; sim.getObjectsInTree(sim.handle_scene) lists what is there)"))
}

/// The old form: a path, or an alias alone.
fn get_object_handle(call: &mut Call<'_>) -> Outcome {
    let name = call.args.text(0)?;
    let path = if name.starts_with('/') { name.to_owned() } else { format!("/{name}") };
    one(paths::find(&call.cell.world.tree, &path, None, None).map_err(|error| unknown(error, &path))?)
}

fn get_object_alias(call: &mut Call<'_>) -> Outcome {
    one(paths::alias(&call.cell.world.tree, call.args.handle(0)?, call.args.integer_or(1, -1)?)?)
}

fn set_object_alias(call: &mut Call<'_>) -> Outcome {
    const MAX_ALIAS_BYTES: usize = 200;
    let object = call.cell.world.tree.get_mut(call.args.handle(0)?)?;
    let alias: String = call.args.text(1)?.chars().filter(|c| !"/[]{}*?".contains(*c) && !c.is_control()).collect();
    if alias.is_empty() || alias.len() > MAX_ALIAS_BYTES {
        return Err(WorldError::InvalidArguments.into());
    }
    object.alias = alias;
    one(1)
}

fn get_objects(call: &mut Call<'_>) -> Outcome {
    let (index, kind) = (call.args.integer(0)?, call.args.integer_or(1, HANDLE_ALL)?);
    let mut all = call.cell.world.tree.iter().filter(|(_, object)| kind == HANDLE_ALL || object.kind.code() == kind);
    one(usize::try_from(index).ok().and_then(|index| all.nth(index)).map_or(-1, |(handle, _)| handle))
}

fn get_objects_in_tree(call: &mut Call<'_>) -> Outcome {
    let tree = &call.cell.world.tree;
    let base = call.args.handle(0)?;
    let (kind, options) = (call.args.integer_or(1, HANDLE_ALL)?, call.args.integer_or(2, 0)?);
    let (exclude_base, children_only) = (options & 1 != 0, options & 2 != 0);
    let mut all = match (base, children_only) {
        (HANDLE_SCENE, true) => tree.roots().to_vec(),
        (HANDLE_SCENE, false) => tree.breadth_first(tree.roots().to_vec()),
        (base, true) => std::iter::once(base).chain(tree.get(base)?.children().iter().copied()).collect(),
        (base, false) => tree.subtree(base)?,
    };
    all.retain(|&handle| !(exclude_base && handle == base));
    all.retain(|&handle| kind == HANDLE_ALL || tree.get(handle).is_ok_and(|object| object.kind.code() == kind));
    one(wire::integers(all))
}

fn get_object_parent(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.tree.get(call.args.handle(0)?)?.parent().unwrap_or(-1))
}

fn set_object_parent(call: &mut Call<'_>) -> Outcome {
    let (handle, parent) = (call.args.handle(0)?, optional(call.args.integer_or(1, -1)?));
    let in_place = call.args.boolean_or(2, true)?;
    call.cell.world.tree.set_parent(handle, parent, in_place)?;
    nothing()
}

fn get_object_child(call: &mut Call<'_>) -> Outcome {
    let children = call.cell.world.tree.get(call.args.handle(0)?)?.children();
    let index = usize::try_from(call.args.integer(1)?).ok().ok_or(WorldError::InvalidArguments)?;
    one(children.get(index).copied().unwrap_or(-1))
}

fn get_object_type(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.tree.get(call.args.handle(0)?)?.kind.code())
}

fn is_handle(call: &mut Call<'_>) -> Outcome {
    one(call.cell.world.tree.contains(call.args.handle(0)?))
}

/// The second argument, a colour, may be anything: dummies are not seen.
fn create_dummy(call: &mut Call<'_>) -> Outcome {
    let size_m = call.args.number(0)?;
    if !(size_m.is_finite() && size_m >= 0.0) {
        return Err(WorldError::InvalidData.into());
    }
    one(call.cell.world.tree.add("Dummy", Kind::Dummy { size_m }, None, Isometry3::identity())?)
}

fn remove_object(call: &mut Call<'_>) -> Outcome {
    call.cell.world.tree.remove(call.args.handle(0)?)?;
    one(1)
}

fn remove_objects(call: &mut Call<'_>) -> Outcome {
    let handles = call.args.handles(0)?;
    let tree = &mut call.cell.world.tree;
    // All or none: a list with one wrong handle leaves the scene as it was.
    if let Some(error) = handles.iter().find_map(|&handle| tree.get(handle).err()) {
        return Err(ApiError::World(error));
    }
    for handle in handles {
        if tree.contains(handle) {
            tree.remove(handle)?;
        }
    }
    nothing()
}

/// `sim.modelproperty_not_model` (0xf000) for all but the bases of models.
fn get_model_property(call: &mut Call<'_>) -> Outcome {
    let object = call.cell.world.tree.get(call.args.handle(0)?)?;
    one(Value::from(if object.model_base { 0 } else { 0xf000 }))
}
