"""The paper's estimator: a Gaussian process over a sliding window of readings.

`gp.WindowGP` is the estimator; `kernels` has the covariances of readings, `weights` the weights of one window's
readings, `regular` the windows whose weights can be looked up, `batch` many windows one after the other.
"""
