from glob import glob

from setuptools import find_packages, setup

package_name = 'lab2'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*.py')),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='The lab team',
    maintainer_email='lab2@example.com',
    description='Talkers and listeners: the package of lab 2',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'talker = lab2.talker:main',
            'listener = lab2.listener:main',
            'numeric_talker = lab2.numeric_talker:main',
            'numeric_listener = lab2.numeric_listener:main',
        ],
    },
)
