/* What host and device share. src/trace/opencl/layout.rs has the same structs, and asks `layout` below whether it
   is so. Coordinates are those of the mesh times a power of two that makes the scene about 1 wide. In 3D w is 0. */

/* What is in the up to eight boxes of a node: children that are nodes, and then leaves. */
typedef struct {
    uint children;  /* the first child that is a node; the others follow it */
    uint simplices; /* the first simplex of the leaves */
    uint2 leaves;   /* a byte a child; of a leaf 8 * (its first simplex, counted from `simplices`) + how many it has */
    uint inner;     /* how many children are nodes */
    uint padding;
} Node;

typedef struct {
    float4 position;
    float4 axis;     /* of the reflection that makes the frame */
    uint4 keys;      /* of the scramblings of the coordinates, and of the index */
    float factor;    /* of the reflection */
    uint turned;     /* whether its sign is */
    uint ignored;    /* the simplex that rays don't hit, or NONE */
    uint star;       /* where it is told what the simplices around it hide, or NONE */
    uint next;       /* the first ray's place in its sequence */
    uint vertex;     /* the vertex in this place, or NONE */
    uint padding[2];
} Point;

/* A cone that a simplex around a point hides; or the head of a point's cones, which tells in `normals[0]` how many there are, as an
   integer's bits, and the height over the tangent hyperplane above which they hide nothing. */
typedef struct {
    float4 normals[4]; /* inward, of length about 1 */
    float4 bounds;     /* on the rounding of their products with a direction */
} StarCone;

/* A vertex whose cones are asked for. */
typedef struct {
    float4 position;
    float4 normal;
    uint vertex; /* as in Point */
    uint star;   /* where the head goes */
    uint padding[2];
} Apex;

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
    Apex apex;
    sizes[0] = sizeof(Node);
    sizes[1] = (uint)((uintptr_t)&node.leaves - (uintptr_t)&node);
    sizes[2] = (uint)((uintptr_t)&node.inner - (uintptr_t)&node);
    sizes[3] = sizeof(Point);
    sizes[4] = (uint)((uintptr_t)&point.keys - (uintptr_t)&point);
    sizes[5] = (uint)((uintptr_t)&point.factor - (uintptr_t)&point);
    sizes[6] = (uint)((uintptr_t)&point.next - (uintptr_t)&point);
    sizes[7] = sizeof(StarCone);
    sizes[8] = (uint)((uintptr_t)&cone.bounds - (uintptr_t)&cone);
    sizes[9] = sizeof(Apex);
    sizes[10] = (uint)((uintptr_t)&apex.vertex - (uintptr_t)&apex);
}
