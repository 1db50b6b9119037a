"""A step of Genesis' rigid solver, without what a city of solids that never move makes slow.

Genesis fits a box around every shape at every step, and compares each with every pair of links that may touch. Here
only shapes that can move are fitted, and those of a pair of links are compared: the same contacts, in another order.
What else a step of a Genesis scene does (timers, recorders, sensors, counting) is left out.

Import this only once Genesis has been started: kernels take types from it, so annotations here are values, no names.
"""

# mypy: disable-error-code="valid-type,no-untyped-def"
from typing import Any

import genesis as gs
import genesis.utils.array_class as array_class
import quadrants as qd
from genesis.engine.solvers.rigid.abd.forward_kinematics import func_forward_velocity, func_update_cartesian_space
from genesis.engine.solvers.rigid.collider.broadphase import (
    _func_broad_phase_links_all_vs_all,
    _func_broad_phase_links_sap,
    func_collision_clear,
)
from genesis.engine.solvers.rigid.collider.contact import func_clamp_prune_contacts
from genesis.engine.solvers.rigid.collider.narrowphase import (
    func_narrow_phase_any_vs_terrain,
    func_narrow_phase_convex_specializations,
    func_narrow_phase_convex_vs_convex,
    func_narrow_phase_nonconvex_vs_nonterrain,
)
from genesis.engine.solvers.rigid.collider.utils import func_is_geom_aabbs_overlap
from genesis.engine.solvers.rigid.constraint.solver import (
    func_add_equality_constraints,
    func_add_inequality_constraints,
    func_resolve_post,
    func_solve_init,
    func_solve_iter,
)
from genesis.engine.solvers.rigid.rigid_solver import func_step_1, func_step_2
from genesis.utils import geom as gu


@qd.func
def _fit_boxes(
    geoms_init_AABB: array_class.GeomsInitAABB,
    dyn_state: array_class.DynState,
    dyn_info: array_class.DynInfo,
):
    """Fit the boxes around shapes that can move; whoever places another one fits its box."""
    qd.loop_config(serialize=True)
    for i_g in range(dyn_state.geoms.pos.shape[0]):
        if not dyn_info.geoms.is_fixed[i_g]:
            lower, upper = gu.qd_vec3(qd.math.inf), gu.qd_vec3(-qd.math.inf)
            for i_corner in qd.static(range(8)):
                corner = gu.qd_transform_by_trans_quat(
                    geoms_init_AABB[i_g, i_corner], dyn_state.geoms.pos[i_g, 0], dyn_state.geoms.quat[i_g, 0]
                )
                lower, upper = qd.min(lower, corner), qd.max(upper, corner)
            dyn_state.geoms.aabb_min[i_g, 0] = lower
            dyn_state.geoms.aabb_max[i_g, 0] = upper


@qd.func
def _pair_shapes(
    dyn_state: array_class.DynState,
    collider_state: array_class.ColliderState,
    dyn_info: array_class.DynInfo,
    collider_info: array_class.ColliderInfo,
    errno: qd.Tensor,
):
    """List the pairs of shapes whose boxes overlap, link pair by link pair."""
    qd.loop_config(serialize=True)
    for i_b in range(1):
        for i_lp_ in range(collider_state.n_broad_link_pairs[i_b]):
            links = collider_info.valid_link_pairs[collider_state.broad_link_pairs[i_lp_, i_b]]
            # The first link of a pair is the one with more shapes.
            for i_g in range(dyn_info.links.geom_start[links[0]], dyn_info.links.geom_end[links[0]]):
                is_near = not (
                    (dyn_state.geoms.aabb_max[i_g, i_b] <= collider_state.links_aabb_min[links[1], i_b]).any()
                    or (dyn_state.geoms.aabb_min[i_g, i_b] >= collider_state.links_aabb_max[links[1], i_b]).any()
                )
                if is_near:
                    for i_other in range(dyn_info.links.geom_start[links[1]], dyn_info.links.geom_end[links[1]]):
                        i_ga, i_gb = qd.min(i_g, i_other), qd.max(i_g, i_other)
                        if collider_info.collision_pair_idx[i_ga, i_gb] != -1:  # noqa: SIM102 (`and` evaluates both)
                            if func_is_geom_aabbs_overlap(i_ga, i_gb, i_b, dyn_state):
                                count = collider_state.n_broad_pairs[i_b]
                                collider_state.n_broad_pairs[i_b] = count + 1
                                if count < collider_info.max_collision_pairs_broad[None]:
                                    collider_state.broad_collision_pairs[count, i_b][0] = i_ga
                                    collider_state.broad_collision_pairs[count, i_b][1] = i_gb
                                else:
                                    errno[i_b] = errno[i_b] | array_class.ErrorCode.OVERFLOW_CANDIDATE_CONTACTS


@qd.func
def _detect(  # noqa: PLR0917 (it is given all that it reads)
    geoms_init_AABB: array_class.GeomsInitAABB,
    dyn_state: array_class.DynState,
    collider_state: array_class.ColliderState,
    mpr_state: array_class.MPRState,
    gjk_state: array_class.GJKState,
    diff_contact_input: array_class.DiffContactInput,
    constraint_state: array_class.ConstraintState,
    dyn_info: array_class.DynInfo,
    rigid_info: array_class.RigidInfo,
    collider_info: array_class.ColliderInfo,
    rigid_config: qd.template(),
    collider_static_config: qd.template(),
    gjk_static_config: qd.template(),
    errno: qd.Tensor,
):
    """Find contacts: `func_detection` of Genesis on a processor, with the functions above for its own."""
    _fit_boxes(geoms_init_AABB, dyn_state, dyn_info)
    func_collision_clear(
        dyn_state, collider_state, dyn_info, rigid_info, collider_info, rigid_config, collider_static_config
    )
    if qd.static(rigid_config.broadphase_traversal == gs.broadphase_traversal.ALL_VS_ALL):
        _func_broad_phase_links_all_vs_all(
            dyn_state, collider_state, constraint_state, dyn_info, rigid_info, collider_info, rigid_config
        )
    else:
        _func_broad_phase_links_sap(
            dyn_state, collider_state, constraint_state, dyn_info, rigid_info, collider_info, rigid_config
        )
    _pair_shapes(dyn_state, collider_state, dyn_info, collider_info, errno)
    if qd.static(collider_static_config.has_non_box_plane_convex_convex):
        func_narrow_phase_convex_vs_convex(
            geoms_init_AABB=geoms_init_AABB,
            dyn_state=dyn_state,
            collider_state=collider_state,
            mpr_state=mpr_state,
            gjk_state=gjk_state,
            diff_contact_input=diff_contact_input,
            dyn_info=dyn_info,
            rigid_info=rigid_info,
            collider_info=collider_info,
            rigid_config=rigid_config,
            collider_static_config=collider_static_config,
            gjk_static_config=gjk_static_config,
            errno=errno,
        )
    if qd.static(collider_static_config.has_convex_specialization):
        func_narrow_phase_convex_specializations(
            geoms_init_AABB,
            dyn_state,
            collider_state,
            dyn_info,
            rigid_info,
            collider_info,
            rigid_config,
            collider_static_config,
            errno,
        )
    if qd.static(collider_static_config.has_terrain):
        func_narrow_phase_any_vs_terrain(
            geoms_init_AABB,
            dyn_state,
            collider_state,
            mpr_state,
            dyn_info,
            rigid_info,
            collider_info,
            rigid_config,
            collider_static_config,
            errno,
        )
    if qd.static(collider_static_config.has_nonconvex_nonterrain):
        func_narrow_phase_nonconvex_vs_nonterrain(
            dyn_state,
            collider_state,
            dyn_info,
            rigid_info,
            collider_info,
            rigid_config,
            collider_static_config,
            errno,
        )
    func_clamp_prune_contacts(
        dyn_state, collider_state, rigid_info, collider_info, rigid_config, collider_static_config, errno
    )


@qd.kernel(fastcache=True)
def _place(
    dyn_state: array_class.DynState,
    dyn_info: array_class.DynInfo,
    rigid_info: array_class.RigidInfo,
    rigid_config: qd.template(),
):
    """Compute poses and velocities of links from those of joints, as the end of a step does."""
    func_update_cartesian_space(dyn_state, dyn_info, rigid_info, rigid_config, False, False)
    func_forward_velocity(dyn_state, dyn_info, rigid_info, rigid_config, False)


@qd.kernel(fastcache=True)
def _begin_step(  # noqa: PLR0917 (a kernel is given all that it reads)
    geoms_init_AABB: array_class.GeomsInitAABB,
    dyn_state: array_class.DynState,
    collider_state: array_class.ColliderState,
    mpr_state: array_class.MPRState,
    gjk_state: array_class.GJKState,
    diff_contact_input: array_class.DiffContactInput,
    constraint_state: array_class.ConstraintState,
    dyn_info: array_class.DynInfo,
    rigid_info: array_class.RigidInfo,
    collider_info: array_class.ColliderInfo,
    rigid_config: qd.template(),
    collider_static_config: qd.template(),
    gjk_static_config: qd.template(),
    can_touch: qd.template(),
    errno: qd.Tensor,
):
    """Find forces, contacts and constraints."""
    func_step_1(dyn_state, constraint_state, dyn_info, rigid_info, rigid_config, True, True, False)
    func_add_equality_constraints(dyn_state, collider_state, constraint_state, dyn_info, rigid_info, rigid_config)
    if qd.static(can_touch):
        _detect(
            geoms_init_AABB=geoms_init_AABB,
            dyn_state=dyn_state,
            collider_state=collider_state,
            mpr_state=mpr_state,
            gjk_state=gjk_state,
            diff_contact_input=diff_contact_input,
            constraint_state=constraint_state,
            dyn_info=dyn_info,
            rigid_info=rigid_info,
            collider_info=collider_info,
            rigid_config=rigid_config,
            collider_static_config=collider_static_config,
            gjk_static_config=gjk_static_config,
            errno=errno,
        )
    func_add_inequality_constraints(
        dyn_state, collider_state, constraint_state, dyn_info, rigid_info, rigid_config, collider_static_config
    )


@qd.kernel(fastcache=True)
def _end_step(
    dyn_state: array_class.DynState,
    collider_state: array_class.ColliderState,
    constraint_state: array_class.ConstraintState,
    dyn_info: array_class.DynInfo,
    rigid_info: array_class.RigidInfo,
    rigid_config: qd.template(),
    errno: qd.Tensor,
):
    """Solve the constraints, once `func_solve_init` has begun to, and move on."""
    qd.loop_config(serialize=True)
    for i_b in range(1):
        if constraint_state.n_constraints[i_b] > 0:
            for it in range(rigid_info.iterations[None]):
                if not constraint_state.improved[i_b]:
                    break
                func_solve_iter(i_b, it, dyn_state, constraint_state, dyn_info, rigid_info, rigid_config)
        else:
            constraint_state.improved[i_b] = False
    func_resolve_post(dyn_state, collider_state, constraint_state, dyn_info, rigid_info, rigid_config, False, errno)
    func_step_2(dyn_state, constraint_state, dyn_info, rigid_info, rigid_config, False, errno)


class SolverStep:
    """A step of a built scene's rigid bodies.

    As `RigidSolver.substep` of Genesis, for one environment without gradients, sleeping bodies or other solvers, in
    three kernels instead of seven: to start one takes as long as many a one of them runs.

    Parameters
    ----------
    solver
        Of a scene with rigid bodies alone, on a processor.
    """

    def __init__(self, solver: Any) -> None:
        s, collider = solver, solver.collider
        constraints = s.constraint_solver.constraint_state
        self._place = s.dyn_state, s.dyn_info, s.rigid_info, s.rigid_config
        self._begin = (
            s.geoms_init_AABB,
            s.dyn_state,
            collider.collider_state,
            collider.mpr.mpr_state,
            collider.gjk.gjk_state,
            collider.gjk.gjk_state.diff_contact_input,
            constraints,
            s.dyn_info,
            s.rigid_info,
            collider.collider_info,
            s.rigid_config,
            collider.collider_config,
            collider.gjk.gjk_config,
            collider._n_possible_pairs > 0,
            s._errno,
        )
        self._solve = s.dyn_state, constraints, s.dyn_info, s.rigid_info, s.rigid_config, True
        self._end = (
            s.dyn_state,
            collider.collider_state,
            constraints,
            s.dyn_info,
            s.rigid_info,
            s.rigid_config,
            s._errno,
        )

    def place(self) -> None:
        """Compute poses and velocities of all links and shapes that can move, from those of joints."""
        _place(*self._place)

    def step(self) -> None:
        """Solve a step; poses and velocities of links are as `place` or the last step left them."""
        _begin_step(*self._begin)
        func_solve_init(*self._solve)
        _end_step(*self._end)
