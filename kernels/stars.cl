/* What the simplices around a vertex hide: the cones of their edges from there and of the inverted normal, as src/trace/surroundings.rs
   has it for vertices that are approached along the normal. A work-item makes the cones of a vertex. */

/* The facet normals, inward, and bounds on the rounding of their products with directions; none can be told inward if rounding
   could decide which way that is: then nothing is told of any direction. Returns the last of them, outward or inward. */
real4 facets_of(const real4 *columns, StarCone *cone, real *last_bound) {
    real4 normals[D];
    real sizes[D], bounds[D], rounding = HALF_ULPS * REAL_HALF_ULP;
    for (int i = 0; i < D; i++) sizes[i] = size(columns[i]);
    real all = rounding;
    for (int i = 0; i < D; i++) all *= sizes[i];
    for (int i = 0; i < D; i++) {
        bounds[i] = rounding;
        for (int k = 0; k < D; k++)
            if (k != i) bounds[i] *= sizes[k];
    }
#if D == 4
    normals[0] = cross_(columns[1], columns[2], columns[3]);
    normals[1] = cross_(columns[0], columns[2], columns[3]);
    normals[2] = cross_(columns[0], columns[1], columns[3]);
    normals[3] = cross_(columns[0], columns[1], columns[2]);
#else
    normals[0] = cross_(columns[1], columns[2]);
    normals[1] = cross_(columns[0], columns[2]);
    normals[2] = cross_(columns[0], columns[1]);
#endif
    /* That of the determinant, but for signs of their own. */
    bool is_sure = fabs(dot_(normals[D - 1], columns[D - 1])) > 4 * all;
    for (int i = 0; i < 4; i++) cone->normals[i] = (float4)(0.0f);
    cone->bounds = (float4)(1.0f);
    if (is_sure) {
        float to[4] = {1.0f, 1.0f, 1.0f, 1.0f};
        for (int i = 0; i < D; i++) {
            real4 n = normals[i], sized = fabs(n);
            real largest = max(max(sized.x, sized.y), max(sized.z, sized.w));
            real scale = (dot_(n, columns[i]) < 0 ? -1 : 1) / largest;
            cone->normals[i] = (float4)((float)(n.x * scale), (float)(n.y * scale), (float)(n.z * scale), (float)(n.w * scale));
            /* The normal's rounding here, that of the product there, and what is too small for single precision. */
            to[i] = (float)(bounds[i] / largest) * 1.01f + 1e-6f;
        }
        cone->bounds = (float4)(to[0], to[1], to[2], to[3]);
    }
    *last_bound = bounds[D - 1];
    return normals[D - 1];
}

/* `around` are the simplices with a corner in the place of a vertex, as they are numbered here, those of vertex i from starts[i] on. */
__kernel void stars(
    MESH, uint empty, __global const uint *starts, __global const uint *around, __global const Apex *apices, ulong count,
    __global StarCone *star) {
    size_t item = get_global_id(0);
    if (item >= count) return;
    Apex apex = apices[item];
    real4 position = REAL4(apex.position), normal = REAL4(apex.normal);
    __global StarCone *next = star + apex.star + 1;
    uint told = 0, end = empty ? 0 : starts[apex.vertex + 1];
    float highest = -2.0f;
    for (uint j = empty ? 0 : starts[apex.vertex]; j < end; j++) {
        uint simplex = around[j];
        __global const float4 *corners = CORNERS(simplex);
        uint4 these = vertices[simplex];
        const uint corner_of[4] = {these.x, these.y, these.z, these.w};
        real4 columns[D];
        int edges = 0;
        bool rises = false;
        for (int corner = 0; corner < D; corner++) {
            if (corner_of[corner] == apex.vertex || edges == D - 1) continue;
            real4 edge = REAL4(corners[corner]) - position;
            rises |= dot_(edge, normal) > -(HALF_ULPS * REAL_HALF_ULP) * size(edge);
            columns[edges++] = edge;
        }
        /* What is wholly below the tangent hyperplane hides nothing above it. */
        if (!rises || edges < D - 1) continue;
        columns[D - 1] = -normal;
        StarCone cone;
        real bound;
        real4 own = facets_of(columns, &cone, &bound);
        next[told++] = cone;
        /* The sine of the angle between the simplex's hyperplane and the tangent hyperplane (src/trace/cpu/packet/star.rs), or more. */
        real product = max(fabs(dot_(own, normal)) - bound * size(normal), (real)0);
        real cosine = min(product / (sqrt(dot_(own, own)) + 2 * bound), (real)1) * (real)(1 - 1e-6);
        highest = max(highest, (float)sqrt(1 - cosine * cosine + (real)1e-6) + 1e-5f);
    }
    StarCone head;
    for (int i = 0; i < 4; i++) head.normals[i] = (float4)(0.0f);
    head.bounds = (float4)(0.0f);
    head.normals[0].x = as_float(told);
    head.normals[0].y = highest;
    star[apex.star] = head;
}
