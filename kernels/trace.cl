/* Rays through the hierarchy that src/trace/opencl/wide.rs makes: nodes of eight boxes. The host tells DEPTH, how many nodes
   lie on its longest way from the root to a leaf. */

#define SUM(v) (v.x + v.y + v.z + v.w)

/* Whether a ray meets a simplex, in single precision, by what src/trace/opencl/facet.rs tells of it: HIT, OPEN or UNSURE. If
   HIT and it is to be measured, *t is the distance and *t_error bounds its rounding.

   The ray's direction w is a sum of the corners as they are seen from its origin. With e the first of them, and the edges d1,
   d2 and d3 from there, the weights have the signs of
       det(e, w, d2, d3), det(e, d1, w, d3), det(e, d1, d2, w), and det(w, d1, d2, d3) less all of these,
   times that of det(e, d1, d2, d3). The first three are sums of products of two minors, one of w and e and one of edges. */
uint crossed(
    float4 position, float4 direction, __global const float4 *facet, bool measured, float *t, float *t_error) {
    /* More than all roundings: of e, of minors here and there, of six products, of sums, and of the bounds themselves. */
    const float rounding = 24.0f * HALF_ULP, tiny = 1e-30f;
    float4 w = direction, first = facet[0], normal = facet[1], e = first - position;
#if D == 4
    float xy = w.x * e.y - w.y * e.x, xz = w.x * e.z - w.z * e.x, xw = w.x * e.w - w.w * e.x;
    float yz = w.y * e.z - w.z * e.y, yw = w.y * e.w - w.w * e.y, zw = w.z * e.w - w.w * e.z;
    float4 f2 = facet[2], f3 = facet[3], f4 = facet[4], f5 = facet[5], f6 = facet[6];
    float a = xy * f2.x + xz * f2.y + xw * f2.z + yz * f2.w + yw * f3.x + zw * f3.y;
    float b = xy * f3.z + xz * f3.w + xw * f4.x + yz * f4.y + yw * f4.z + zw * f4.w;
    float c = xy * f5.x + xz * f5.y + xw * f5.z + yz * f5.w + yw * f6.x + zw * f6.y;
    float part = f6.z, size = f6.w;
#else
    float x = w.y * e.z - w.z * e.y, y = w.z * e.x - w.x * e.z, z = w.x * e.y - w.y * e.x;
    float4 f2 = facet[2], f3 = facet[3];
    float a = x * f2.x + y * f2.y + z * f2.z;
    float b = x * f3.x + y * f3.y + z * f3.z;
    float part = f2.w, size = f3.w;
#endif
    float4 w_size = fabs(w), e_size = fabs(e), whole_parts = w * normal, determinant_parts = e * normal;
    float s_w = rounding * SUM(w_size), s_e = SUM(e_size);
    float whole = SUM(whole_parts), whole_bound = s_w * size + tiny;
    float determinant = SUM(determinant_parts), determinant_bound = rounding * s_e * size + tiny;
    float bound = s_w * s_e * part + tiny;
    /* What is not a number is in doubt. */
    uint above = (a > bound) + (b > bound), below = (-a > bound) + (-b > bound);
    float others = a + b;
#if D == 4
    above += c > bound;
    below += -c > bound;
    others += c;
#endif
    float last = whole - others, last_bound = whole_bound + (D - 1) * bound;
    above += last > last_bound;
    below += -last > last_bound;
    if (above > 0 && below > 0) return OPEN;
    if (above + below == 0) return UNSURE;
    float oriented = above > 0 ? determinant : -determinant;
    if (-oriented > determinant_bound) return OPEN;
    if (!(oriented > determinant_bound) || above + below < D) return UNSURE;
    if (!measured) return HIT;
    *t = oriented / fabs(whole);
    *t_error = 4.0f * *t * (whole_bound / fabs(whole) + determinant_bound / oriented + 4.0f * HALF_ULP);
    return HIT;
}

/* The same, and where that leaves doubt, it is asked for and the device can, in double precision by the corners. */
uint met(
    float4 position, float4 direction, __global const float4 *facet, __global const float4 *corners, bool doubly,
    bool measured, float *t, float *t_error) {
    uint found = crossed(position, direction, facet, measured, t, t_error);
    if (found == UNSURE) {
        /* Of a simplex with a corner here nothing is seen. */
        for (int i = 0; i < D; i++)
            if (all(corners[i] == position)) return OPEN;
#ifdef DOUBLE
        if (doubly) {
            double double_t, double_error;
            found = meets(position, direction, corners, &double_t, &double_error);
            *t = (float)double_t;
            *t_error = (float)double_error + *t * 1e-6f;
        }
#endif
    }
    return found;
}

/* Whether a ray meets a simplex before `limit`. */
uint met_before(
    float4 position, float4 direction, __global const float4 *facet, __global const float4 *corners, float limit,
    bool doubly) {
    bool bounded = limit != INFINITY;
    float t, t_error;
    uint found = met(position, direction, facet, corners, doubly, bounded, &t, &t_error);
    if (found != HIT || !bounded) return found;
    if (t + t_error < limit * (1.0f - 1e-6f)) return HIT;
    return t - t_error > limit * (1.0f + 1e-6f) ? OPEN : UNSURE;
}

/* One over a direction. A component that is next to nothing is taken for 1e-20: over the scene, which is about 1 wide, that
   moves the ray by less than boxes are grown by. So there is nothing here that is not a number. */
float4 inverted(float4 direction) {
    float4 size = fabs(direction);
    return 1.0f / copysign(max(size, 1e-20f), direction);
}

/* A bit for each lane that is true. */
uint bits_of(int8 lanes) {
    int8 bits = lanes & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    int4 half_ = bits.lo | bits.hi;
    int2 quarter = half_.lo | half_.hi;
    return (uint)(quarter.x | quarter.y);
}

/* Which of a node's boxes the ray enters before `limit`, a bit each, and distances before which it doesn't. A side at s is
   s / w - p / w away: `near` and `far` are the second terms. Boxes are larger than what they hold, by more than the rounding here. */
uint boxes(__global const float4 *sides, float4 inverse, float4 near, float4 far, float limit, float8 *distances) {
    float8 enter = (float8)(0.0f), leave = (float8)(limit);
    const float reciprocal[4] = {inverse.x, inverse.y, inverse.z, inverse.w};
    const float to_near[4] = {near.x, near.y, near.z, near.w}, to_far[4] = {far.x, far.y, far.z, far.w};
    for (int axis = 0; axis < D; axis++) {
        __global const float *from = (__global const float *)(sides + 4 * axis);
        int is_negative = reciprocal[axis] < 0.0f;
        enter = max(enter, mad(vload8(is_negative, from), (float8)(reciprocal[axis]), (float8)(to_near[axis])));
        leave = min(leave, mad(vload8(1 - is_negative, from), (float8)(reciprocal[axis]), (float8)(to_far[axis])));
    }
    *distances = enter;
    return bits_of(enter <= leave);
}

/* A distance, brought to between 0 and 1; NVIDIA's processors do that for nothing, but their compiler doesn't know. */
#ifdef __NV_CL_C_VERSION
float within(float side, float reciprocal, float shift) {
    float distance;
    asm("fma.rn.sat.f32 %0, %1, %2, %3;" : "=f"(distance) : "f"(side), "f"(reciprocal), "f"(shift));
    return distance;
}
#else
#define within(side, reciprocal, shift) clamp(mad(side, reciprocal, shift), 0.0f, 1.0f)
#endif

/* A way of length 1: its direction's reciprocal, and (middle - origin) times that. */
typedef struct {
    float4 inverse, shift;
} Way;

/* Which of a node's boxes a way goes through, a bit each. What is behind its origin is entered and left at 0, and what is beyond its
   end at 1; boxes that it goes through are so much larger than what they hold that it leaves them later than it enters them. The sign of
   the difference tells which are which: one instruction a box, where comparing takes two or three. */
uint boxes_on(__global const float4 *sides, const Way *way) {
    const float inverse[4] = {way->inverse.x, way->inverse.y, way->inverse.z, way->inverse.w};
    const float shift[4] = {way->shift.x, way->shift.y, way->shift.z, way->shift.w};
    float enter[8], leave[8];
    for (int axis = 0; axis < D; axis++) {
        float r = inverse[axis], to = shift[axis];
        int is_negative = r < 0.0f;
        __global const float4 *near = sides + 4 * axis + 2 * is_negative, *far = sides + 4 * axis + 2 * (1 - is_negative);
        float4 near_0 = near[0], near_1 = near[1], far_0 = far[0], far_1 = far[1];
        const float nears[8] = {near_0.x, near_0.y, near_0.z, near_0.w, near_1.x, near_1.y, near_1.z, near_1.w};
        const float fars[8] = {far_0.x, far_0.y, far_0.z, far_0.w, far_1.x, far_1.y, far_1.z, far_1.w};
        for (int k = 0; k < 8; k++) {
            float in = within(nears[k], r, to), out = within(fars[k], r, to);
            enter[k] = axis == 0 ? in : fmax(enter[k], in);
            leave[k] = axis == 0 ? out : fmin(leave[k], out);
        }
    }
    uint bits = 0;
    for (int k = 7; k >= 0; k--) bits = bits << 1 | as_uint(enter[k] - leave[k]) >> 31;
    return bits;
}

/* The place of the lowest bit that is set, and the bits without it. */
#define LOWEST(bits) (31u - clz((bits) & (0u - (bits))))
#define WITHOUT_LOWEST(bits) ((bits) & ((bits) - 1u))

/* The simplices of the leaves among these children: the first that the node has, and a bit for each from there on. */
uint2 simplices_of(__global const Node *node, uint children) {
    uint2 bytes = node->leaves;
    uint bits = 0;
    for (; children != 0; children = WITHOUT_LOWEST(children)) {
        uint child = LOWEST(children);
        uint byte = (child < 4 ? bytes.x : bytes.y) >> 8 * (child & 3u);
        bits |= ((1u << (byte & 7u)) - 1u) << (byte >> 3 & 31u);
    }
    return (uint2)(node->simplices, bits);
}

/* What is told of a simplex, and its corners. Devices take no more than so much memory in one piece, so a large mesh is in
   several. */
#define FACET (D == 4 ? 7 : 4)
#define MESH \
    __global const Node *nodes, __global const float4 *sides, __global const float4 *middle, \
    __global const float4 *facets_0, __global const float4 *facets_1, \
    __global const float4 *facets_2, __global const float4 *facets_3, __global const float4 *corners_0, \
    __global const float4 *corners_1, __global const float4 *corners_2, __global const float4 *corners_3, \
    __global const uint *simplices, __global const uint4 *vertices
#define THE_MESH \
    nodes, sides, middle, facets_0, facets_1, facets_2, facets_3, corners_0, corners_1, corners_2, corners_3, simplices, vertices
#if PIECES == 1
#define PLACE(simplex) (size_t)(simplex)
#define PIECE_OF(simplex, name) name##_0
#else
#define PLACE(simplex) (size_t)((simplex) % PIECE)
#define PIECE_OF(simplex, name) \
    ((simplex) / PIECE < 2 ? ((simplex) / PIECE == 0 ? name##_0 : name##_1) : ((simplex) / PIECE == 2 ? name##_2 : name##_3))
#endif
#define FACET_OF(simplex) (PIECE_OF(simplex, facets) + FACET * PLACE(simplex))
#define CORNERS(simplex) (PIECE_OF(simplex, corners) + D * PLACE(simplex))

/* As geometry::Ray: components that would overflow the reciprocal are zero. */
float4 cleaned(float4 direction) {
    direction.x = fabs(direction.x) < 1e-30f ? 0.0f : direction.x;
    direction.y = fabs(direction.y) < 1e-30f ? 0.0f : direction.y;
    direction.z = fabs(direction.z) < 1e-30f ? 0.0f : direction.z;
    direction.w = fabs(direction.w) < 1e-30f ? 0.0f : direction.w;
    return direction;
}

/* What the simplices around the point hide. */
uint hidden_by_star(Point point, float4 direction, __global const StarCone *star) {
    if (point.star == NONE) return OPEN;
    float4 head = star[point.star].normals[0];
    float4 last = (float4)(0.0f, 0.0f, D == 3, D == 4);
    float4 normal = last - point.factor * (D == 3 ? point.axis.z : point.axis.w) * point.axis;
    if (fabs(dot(normal, direction)) > head.y) return OPEN;
    uint found = OPEN;
    float size_ = fabs(direction.x) + fabs(direction.y) + fabs(direction.z) + fabs(direction.w);
    for (uint i = 0; i < as_uint(head.x); i++) {
        __global const StarCone *cone = star + point.star + 1 + i;
        uint inside = 0, outside = 0;
        float bounds[4] = {cone->bounds.x, cone->bounds.y, cone->bounds.z, cone->bounds.w};
        for (int k = 0; k < D; k++) {
            float4 n = cone->normals[k];
            float height = n.x * direction.x + n.y * direction.y + n.z * direction.z + n.w * direction.w;
            inside += height > bounds[k] * size_;
            outside += -height > bounds[k] * size_;
        }
        if (inside == D) return HIT;
        if (outside == 0) found = UNSURE;
    }
    return found;
}

/* Whether anything blocks a ray, but the simplices that the point is in or a corner of. Each round goes through a node or tests
   a simplex, so that of rays that go side by side none waits for long. */
uint blocked(MESH, Point point, float4 direction, float limit, bool doubly) {
    uint found = OPEN;
    /* No ray meets anything farther away than twice the scene's width. */
    float length_ = min(limit, 4.0f);
    Way way;
    way.inverse = inverted(direction) / length_;
    way.shift = (*middle - point.position) * way.inverse;
    /* What is to be visited: the first of a node's children, and a bit for each; likewise simplices. */
    uint2 stack[DEPTH], group = (uint2)(0u, 1u), held = (uint2)(0u, 0u);
    uint depth = 0;
    for (;;) {
        if (held.y == 0) {
            if (group.y == 0) {
                if (depth == 0) return found;
                group = stack[--depth];
            }
            uint place = group.x + LOWEST(group.y);
            __global const Node *node = nodes + place;
            group.y = WITHOUT_LOWEST(group.y);
            if (group.y != 0) stack[depth++] = group;
            uint met_boxes = boxes_on(sides + 4 * D * place, &way), inner = (1u << node->inner) - 1u;
            group = (uint2)(node->children, met_boxes & inner);
            if ((met_boxes & ~inner) != 0) held = simplices_of(node, met_boxes & ~inner);
        }
        while (held.y != 0) {
            uint k = held.x + LOWEST(held.y);
            held.y = WITHOUT_LOWEST(held.y);
            /* Most that are met from a vertex are those around it. */
            if (point.vertex != NONE && any(vertices[k] == point.vertex)) continue;
            uint one = met_before(point.position, direction, FACET_OF(k), CORNERS(k), limit, doubly);
            if (one != OPEN && (point.ignored == NONE || simplices[k] != point.ignored)) {
                if (one == HIT) return HIT;
                found = UNSURE;
            }
            break;
        }
    }
}

/* Rays come from `given`, or where that is not used from the points' sequences. */
#define RAYS \
    __global const Point *points, __global const StarCone *star, __global const uint *sums, \
    __global const float4 *given, uint use_given, uint rays, float limit
#define THE_RAYS points, star, sums, given, use_given, rays, limit

/* The direction of each ray, and what the simplices around its point make of it. Neighbours are put side by side: each `run` rays of a
   point are in the order of their indices' `places`. */
__kernel void aimed(
    RAYS, uint run, __global const ushort *places, ulong count, __global float4 *directions, __global uint *numbers,
    __global uchar *out) {
    size_t i = get_global_id(0);
    if (i >= count) return;
    Point point = points[i / rays];
    uint k = (uint)(i % rays);
    float4 direction;
    size_t place = i;
    if (use_given) direction = cleaned(given[i]);
    else {
        direction = cleaned(sampled(point, point.next + k, sums));
        uint index = scramble(point.next + k, point.keys.w);
        place = i - k % run + places[run - 1 + index % run];
    }
    directions[place] = direction;
    numbers[place] = (uint)i;
    out[i] = (uchar)hidden_by_star(point, direction, star);
}

/* What becomes of the others. */
__kernel void occluded(
    MESH, uint empty, __global const Point *points, __global const float4 *directions, __global const uint *numbers,
    uint rays, float limit, ulong count, __global uchar *out) {
    size_t place = get_global_id(0);
    if (place >= count) return;
    uint number = numbers[place], found = out[number];
    if (empty || found == HIT) return;
    uint others = blocked(THE_MESH, points[number / rays], directions[place], limit, false);
    if (others != OPEN) out[number] = (uchar)others;
}

/* Whether anything blocks ray number i of all points' rays: HIT, OPEN or UNSURE. */
uint becomes(MESH, uint empty, RAYS, uint i, bool doubly) {
    Point point = points[i / rays];
    float4 direction = cleaned(use_given ? given[i] : sampled(point, point.next + i % rays, sums));
    uint found = hidden_by_star(point, direction, star);
    if (found == HIT || empty) return found;
    uint others = blocked(THE_MESH, point, direction, limit, doubly);
    return others == OPEN ? found : others;
}

/* The same for rays that were unsure, in double precision: those whose numbers are in `again`. They are few, and quickest if none waits
   for others that go in step with it, so only one in SPREAD work-items has a ray. */
__kernel void occluded_again(MESH, uint empty, RAYS, __global const uint *again, ulong count, __global uchar *out) {
    size_t place = get_global_id(0) / SPREAD;
    if (place < count && get_global_id(0) % SPREAD == 0) out[place] = (uchar)becomes(THE_MESH, empty, THE_RAYS, again[place], true);
}

/* Of 32 rays each, which are open and which unsure: a bit a ray, the first in the lowest. */
__kernel void packed(__global const uchar *found, ulong count, __global uint *open, __global uint *unsure) {
    ulong first = 32 * (ulong)get_global_id(0);
    if (first >= count) return;
    uint open_bits = 0, unsure_bits = 0;
    for (uint bit = 0; bit < 32 && first + bit < count; bit++) {
        open_bits |= (uint)(found[first + bit] == OPEN) << bit;
        unsure_bits |= (uint)(found[first + bit] == UNSURE) << bit;
    }
    open[get_global_id(0)] = open_bits;
    unsure[get_global_id(0)] = unsure_bits;
}

/* The simplex that each ray hits first: its number, NONE if there is none, or UNSURE_SIMPLEX. If `bounded`, hits count
   only behind the ray's hit of the simplex `after`, if that is not NONE, whose distance lies between the two of `bounds`:
   nearer hits do not count, farther ones do, and what lies between makes the ray unsure. */
#define UNSURE_SIMPLEX 0xfffffffeu

__kernel void first_hit(
    MESH, uint empty, __global const float4 *origins, __global const float4 *given, uint bounded,
    __global const uint *after, __global const float2 *bounds, ulong count, __global uint *out) {
    size_t i = get_global_id(0);
    if (i >= count) return;
    if (empty) {
        out[i] = NONE;
        return;
    }
    float4 position = origins[i], direction = cleaned(given[i]);
    /* From far away, distances are rounded by more than boxes are grown by. */
    float4 inverse = inverted(direction), way = *middle - position;
    float4 near = way * inverse - 1e-6f * fabs(way * inverse), far = way * inverse + 1e-6f * fabs(way * inverse);
    uint passed = bounded ? after[i] : NONE;
    float2 bound = bounded ? bounds[i] : (float2)(0.0f, 0.0f);
    uint best = NONE;
    float nearest = INFINITY, error = 0.0f, doubt = INFINITY;
    /* Nodes that are to be visited, the nearest on top, and the distances of their boxes. */
    uint stack[7 * DEPTH + 1];
    float entered[7 * DEPTH + 1];
    stack[0] = 0;
    entered[0] = 0.0f;
    uint depth = 1;
    while (depth > 0) {
        depth--;
        float limit = nearest + error;
        if (entered[depth] > limit * (1.0f + 2e-6f)) continue;
        __global const Node *node = nodes + stack[depth];
        float8 distances;
        uint met_boxes = boxes(sides + 4 * D * stack[depth], inverse, near, far, limit, &distances);
        uint inner = (1u << node->inner) - 1u;
        if ((met_boxes & ~inner) != 0) {
            uint2 held = simplices_of(node, met_boxes & ~inner);
            for (; held.y != 0; held.y = WITHOUT_LOWEST(held.y)) {
                uint k = held.x + LOWEST(held.y);
                if (passed != NONE && simplices[k] == passed) continue;
                float t, t_error;
                uint one = met(position, direction, FACET_OF(k), CORNERS(k), true, true, &t, &t_error);
                if (one == OPEN) continue;
                if (passed != NONE && one == HIT) {
                    if (t + t_error < bound.x) continue;
                    if (!(t - t_error > bound.y)) one = UNSURE;
                }
                if (one == UNSURE) {
                    /* It may be hit, as near as its box. */
                    doubt = 0.0f;
                    continue;
                }
                if (best != NONE && fabs(t - nearest) <= t_error + error) doubt = min(doubt, max(t, nearest));
                if (t < nearest) {
                    best = simplices[k];
                    nearest = t;
                    error = t_error;
                }
            }
        }
        float enter[8];
        vstore8(distances, 0, enter);
        uint bottom = depth;
        for (uint nodes_met = met_boxes & inner; nodes_met != 0; nodes_met = WITHOUT_LOWEST(nodes_met)) {
            uint child = LOWEST(nodes_met), place = depth++;
            for (; place > bottom && entered[place - 1] < enter[child]; place--) {
                stack[place] = stack[place - 1];
                entered[place] = entered[place - 1];
            }
            stack[place] = node->children + child;
            entered[place] = enter[child];
        }
    }
    out[i] = doubt <= nearest + error ? UNSURE_SIMPLEX : best;
}
