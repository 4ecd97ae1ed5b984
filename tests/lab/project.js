points => {
    viewer.render();
    // Meshcat's scene has its y axis up, so World is turned in it.
    const world = viewer.scene_tree.object.matrixWorld;
    return points.map(point => new MeshCat.THREE.Vector3(...point)
        .applyMatrix4(world).project(viewer.camera).toArray());
}
