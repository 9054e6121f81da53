// What every family of kernels shares with the Python module.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

void bind_regional(nanobind::module_ &module);
void bind_encoding(nanobind::module_ &module);
void bind_diagonal(nanobind::module_ &module);
void bind_dtw(nanobind::module_ &module);
void bind_states(nanobind::module_ &module);
void bind_graph(nanobind::module_ &module);
void bind_trajectories(nanobind::module_ &module);
void bind_thumbnails(nanobind::module_ &module);
void bind_keypoints(nanobind::module_ &module);
