/* Embree 3 behind two pipes, for mod.rs: the numbers of the field's best kernel, on the same
 * rays, in turns with ours, and no foreign code in the renderer.
 *
 * Commands are a letter on stdin, answers doubles on stdout:
 *   m vertices triangles, float[3] each, uint32[3] each     the mesh
 *   r rays, {origin, t_min, direction, t_max} each          the rays
 *   1, W  closest hits, one by one or 16 at a time          -> seconds, sum of t
 *   o, O  whether there is a hit, the same ways             -> seconds, number of rays that hit
 *   f float[3] for each vertex: moved, and the tree fitted  -> seconds, 0
 * cc -O3 -march=native embree.c -lembree3 -lm
 */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define WIDE 16

struct Ray {
    float origin[3], t_min, direction[3], t_max;
};

static RTCDevice device;
static RTCScene scene;
static RTCGeometry mesh;
static float *positions;
static struct Ray *rays;
static uint32_t vertex_count, ray_count;

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

static void get(void *to, size_t size, size_t count)
{
    if (fread(to, size, count, stdin) != count)
        exit(1);
}

static void read_mesh(void)
{
    uint32_t counts[2];
    get(counts, sizeof *counts, 2);
    vertex_count = counts[0];
    mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    positions = rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertex_count);
    uint32_t *triangles = rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, counts[1]);
    get(positions, 12, vertex_count);
    get(triangles, 12, counts[1]);
    rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(mesh);
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);
}

static void read_rays(void)
{
    get(&ray_count, sizeof ray_count, 1);
    rays = realloc(rays, ray_count * sizeof *rays);
    get(rays, sizeof *rays, ray_count);
}

/* Fits the tree of a scene of its own: one for moving meshes is of another quality. */
static double refit(void)
{
    static RTCScene moving;
    if (!moving) {
        moving = rtcNewScene(device);
        rtcSetSceneFlags(moving, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
        rtcSetSceneBuildQuality(moving, RTC_BUILD_QUALITY_LOW);
        rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_REFIT);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(moving, mesh);
        rtcCommitScene(moving);
    }
    get(positions, 12, vertex_count);
    double start = now();
    rtcUpdateGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(mesh);
    rtcCommitScene(moving);
    return now() - start;
}

static struct RTCRay single(const struct Ray *ray)
{
    struct RTCRay to = {0};
    to.org_x = ray->origin[0], to.org_y = ray->origin[1], to.org_z = ray->origin[2];
    to.dir_x = ray->direction[0], to.dir_y = ray->direction[1], to.dir_z = ray->direction[2];
    to.tnear = ray->t_min, to.tfar = ray->t_max, to.mask = -1;
    return to;
}

static void fill(struct RTCRay16 *to, int *valid, uint32_t first)
{
    for (int i = 0; i < WIDE; i++) {
        valid[i] = first + i < ray_count ? -1 : 0;
        const struct Ray *ray = &rays[valid[i] ? first + i : first];
        to->org_x[i] = ray->origin[0], to->org_y[i] = ray->origin[1], to->org_z[i] = ray->origin[2];
        to->dir_x[i] = ray->direction[0], to->dir_y[i] = ray->direction[1];
        to->dir_z[i] = ray->direction[2];
        to->tnear[i] = ray->t_min, to->tfar[i] = ray->t_max, to->mask[i] = -1;
        to->time[i] = 0, to->flags[i] = 0;
    }
}

static double one_by_one(int is_any)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    double sum = 0;
    for (uint32_t i = 0; i < ray_count; i++) {
        struct RTCRayHit hit = {.ray = single(&rays[i])};
        hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        if (is_any) {
            rtcOccluded1(scene, &context, &hit.ray);
            sum += hit.ray.tfar < 0;
        } else {
            rtcIntersect1(scene, &context, &hit);
            sum += hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 0 : hit.ray.tfar;
        }
    }
    return sum;
}

static double wide(int is_any)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    double sum = 0;
    for (uint32_t first = 0; first < ray_count; first += WIDE) {
        __attribute__((aligned(64))) struct RTCRayHit16 hit;
        __attribute__((aligned(64))) int valid[WIDE];
        fill(&hit.ray, valid, first);
        memset(hit.hit.geomID, 0xff, sizeof hit.hit.geomID);
        if (is_any)
            rtcOccluded16(valid, scene, &context, &hit.ray);
        else
            rtcIntersect16(valid, scene, &context, &hit);
        for (int i = 0; i < WIDE && valid[i]; i++) {
            int missed = hit.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID;
            sum += is_any ? hit.ray.tfar[i] < 0 : missed ? 0 : hit.ray.tfar[i];
        }
    }
    return sum;
}

int main(void)
{
    device = rtcNewDevice("threads=1");
    for (int command; (command = getchar()) != EOF;) {
        if (command == 'm') {
            read_mesh();
            continue;
        }
        if (command == 'r') {
            read_rays();
            continue;
        }
        double start = now(), answer[2] = {0, 0};
        switch (command) {
        case '1': answer[1] = one_by_one(0); break;
        case 'W': answer[1] = wide(0); break;
        case 'o': answer[1] = one_by_one(1); break;
        case 'O': answer[1] = wide(1); break;
        case 'f': answer[0] = refit(); break;
        default: return 1;
        }
        if (command != 'f')
            answer[0] = now() - start;
        fwrite(answer, sizeof *answer, 2, stdout);
        fflush(stdout);
    }
    return 0;
}
