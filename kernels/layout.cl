/* What host and device share. src/trace/opencl/layout.rs has the same structs, and asks `layout` below whether it
   is so. Coordinates are those of the mesh times a power of two that makes the scene about 1 wide. In 3D w is 0. */

typedef struct {
    float4 low;
    float4 high;
    uint first; /* the first simplex of a leaf, or the left one of two neighbouring children */
    uint count; /* simplices of a leaf; 0 for an inner node */
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
    uint padding[2];
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
    Node node;
    Point point;
    StarCone cone;
    sizes[0] = sizeof(Node);
    sizes[1] = (uint)((uintptr_t)&node.first - (uintptr_t)&node);
    sizes[2] = sizeof(Point);
    sizes[3] = (uint)((uintptr_t)&point.keys - (uintptr_t)&point);
    sizes[4] = (uint)((uintptr_t)&point.factor - (uintptr_t)&point);
    sizes[5] = (uint)((uintptr_t)&point.next - (uintptr_t)&point);
    sizes[6] = sizeof(StarCone);
    sizes[7] = (uint)((uintptr_t)&cone.bounds - (uintptr_t)&cone);
}
