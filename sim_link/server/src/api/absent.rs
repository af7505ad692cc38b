//! Functions of CoppeliaSim that a cell of this kind does not have. They are listed among the others, because clients
//! build their objects from that list and have no useful error for functions that are not in it, and their errors state
//! what to do instead.

use super::{ApiError, Call, Outcome, Table};

pub const FUNCTIONS: Table = &[
    ("callScriptFunction", no_scripts),
    ("executeScriptString", no_scripts),
    ("getScript", no_scripts),
    ("closeScene", one_scene),
    ("loadModel", one_scene),
    ("loadScene", one_scene),
    ("saveScene", one_scene),
    ("setJointMaxForce", positions_only),
    ("setJointTargetForce", positions_only),
    ("setJointTargetVelocity", positions_only),
    ("readForceSensor", cameras_only),
    ("readProximitySensor", cameras_only),
    ("setVisionSensorImg", cameras_write),
    ("getApiFunc", no_description),
    ("getApiInfo", no_description),
];

fn refused(why: &str) -> Outcome {
    Err(ApiError::Other(why.to_owned()))
}

fn no_scripts(_call: &mut Call<'_>) -> Outcome {
    refused("the built-in cell has no scripts; leave the call out.")
}

fn one_scene(_call: &mut Call<'_>) -> Outcome {
    refused(
        "the built-in cell has only the scene it was started with; leave the call out, or start the cell with `handeye \
         cell --scene FILE`, a scene file of its own format.",
    )
}

fn positions_only(_call: &mut Call<'_>) -> Outcome {
    refused("joints of the built-in cell are moved by position: use sim.setJointTargetPosition.")
}

fn cameras_only(_call: &mut Call<'_>) -> Outcome {
    refused("the built-in cell has vision sensors only.")
}

fn cameras_write(_call: &mut Call<'_>) -> Outcome {
    refused("images of the built-in cell come from its cameras and cannot be written.")
}

fn no_description(_call: &mut Call<'_>) -> Outcome {
    refused("the built-in cell has no descriptions of functions; zmqRemoteApi.info lists their names.")
}
