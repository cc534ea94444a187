#pragma once
/// The keys of the tables of stages and studies, bound to their members.
#include "scene_keys.hpp"

namespace squeal
{

SceneKeys keys_of(ModesSettings& modes);
SceneKeys keys_of(EstimateSettings& estimate);
SceneKeys keys_of(TransientSettings& transient);
SceneKeys keys_of(CycleSettings& cycle);
SceneKeys keys_of(BranchSettings& branch);
SceneKeys keys_of(SweepSettings& sweep);
SceneKeys keys_of(SensitivitySettings& sensitivity);
SceneKeys keys_of(Change& change);
SceneKeys keys_of(ResponseSettings& response);
SceneKeys keys_of(RobustnessSettings& robustness);
SceneKeys keys_of(UncertainNumber& number);

} // namespace squeal
