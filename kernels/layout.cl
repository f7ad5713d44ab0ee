/* What host and device share. src/trace/opencl/layout.rs has the same structs, and asks `layout` below whether it
   is so. Coordinates are those of the mesh times a power of two that makes the scene about 1 wide. In 3D w is 0. */

/* Up to eight boxes, of children that are nodes and then of those that are leaves. On each axis a box goes from origin + low *
   2^(exponent - 127) to origin + high * 2^(exponent - 127), one byte each for low, high and exponent. */
typedef struct {
    float4 origin;
    uint exponents;  /* of the axes, the first in the lowest byte */
    uint children;   /* the first child that is a node; the others follow it */
    uint simplices;  /* the first simplex of the leaves */
    uint counts;     /* in the lowest byte how many children are nodes, in the next how many children there are */
    uint4 sides[4];  /* of each axis, a byte a child: low in the first eight, high in the others */
    uint2 leaves;    /* a byte a child; of a leaf 8 * (its first simplex, counted from `simplices`) + how many it has */
    uint padding[2];
} Node;

typedef struct {
    float4 position;
    float4 axis;     /* of the reflection that makes the frame */
    uint4 keys;      /* of the scramblings of the coordinates, and of the index */
    float factor;    /* of the reflection */
    uint turned;     /* whether its sign is */
    uint ignored;    /* the simplex that rays don't hit, or NONE */
    uint star_first; /* the cones that the simplices around it hide */
    uint star_count;
    uint next;       /* the first ray's place in its sequence */
    uint vertex;     /* the vertex in this place, or NONE */
    float star_height; /* above which, over the tangent hyperplane, nothing is hidden by them */
} Point;

typedef struct {
    float4 normals[4]; /* inward, of length about 1 */
    float4 bounds;     /* on the rounding of their products with a direction */
} StarCone;

#define NONE 0xffffffffu

/* What is known of a ray. */
#define OPEN 0
#define HIT 1
#define UNSURE 2

__kernel void layout(__global uint *sizes) {
    if (get_global_id(0) > 0) return;
    Node node;
    Point point;
    StarCone cone;
    sizes[0] = sizeof(Node);
    sizes[1] = (uint)((uintptr_t)&node.leaves - (uintptr_t)&node);
    sizes[2] = (uint)((uintptr_t)&node.sides - (uintptr_t)&node);
    sizes[3] = sizeof(Point);
    sizes[4] = (uint)((uintptr_t)&point.keys - (uintptr_t)&point);
    sizes[5] = (uint)((uintptr_t)&point.factor - (uintptr_t)&point);
    sizes[6] = (uint)((uintptr_t)&point.next - (uintptr_t)&point);
    sizes[7] = sizeof(StarCone);
    sizes[8] = (uint)((uintptr_t)&cone.bounds - (uintptr_t)&cone);
}
